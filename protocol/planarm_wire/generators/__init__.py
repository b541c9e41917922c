"""One module for each file that is generated from the specification: text in memory, nothing is written here."""
