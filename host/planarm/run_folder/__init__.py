"""What a run leaves on disk: its folder, its summary and its pictures."""
