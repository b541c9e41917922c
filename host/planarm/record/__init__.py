"""A run as plain JSON values: what planarm shows of it, and `planarm report` shows again, without planning anything."""
