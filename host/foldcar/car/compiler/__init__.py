"""The compiler's machinery: from a tree of components and their parameters to pieces, joins, parts and axles."""
