"""The commands of `foldcar`, one file each: options in, one call into the library, text out."""
