"""Real links, one file per driver; the file name is the driver's name in a bench file."""
