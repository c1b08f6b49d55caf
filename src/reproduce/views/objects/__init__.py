"""The objects of the front door, one file for each: what it shows, gives and can be rerun with."""
