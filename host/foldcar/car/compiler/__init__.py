"""From a type string and parameters to a folded car: components, what they are connected with, their geometry."""
