"""foldcar in Python: studies as tables and rates, designs and environments as a black box. docs/python.md shows how."""
