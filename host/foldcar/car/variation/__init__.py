"""How built cars differ from their design: spreads, draws from them, bodies with them."""
