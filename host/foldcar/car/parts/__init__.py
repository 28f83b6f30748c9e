"""Bought parts and film as data, and mass properties of assemblies."""
