"""A run watched and steered while it goes on: what is known of it, and a page for it on this computer alone."""
