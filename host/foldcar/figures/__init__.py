"""Pictures of scenes and runs. Modules import them inside functions, because matplotlib is slow to import."""
