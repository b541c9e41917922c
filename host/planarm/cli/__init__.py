"""The command line: it parses and prints, nothing else. Every heavy import waits until a command needs it."""
