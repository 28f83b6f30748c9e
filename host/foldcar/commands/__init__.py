"""The commands of `foldcar`, one file each: they read options, call the library and print text."""
