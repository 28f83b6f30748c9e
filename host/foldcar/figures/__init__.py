"""Pictures of scenes and runs. Import them where they are used: matplotlib takes a moment."""
