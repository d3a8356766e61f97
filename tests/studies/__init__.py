"""Studies: what the program says of units and rigs that were not made with its own pages in mind."""
