"""The folded car: faces, creases and joins of film, flat and folded; its checks and its mass properties."""
