"""Bought parts and film as data, and the mass properties of what is made of them."""
