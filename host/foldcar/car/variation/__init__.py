"""How built cars differ from their design: spreads, random draws from them, bodies with the drawn differences."""
