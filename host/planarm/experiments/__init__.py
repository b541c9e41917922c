"""The papers' tables, computed anew and set beside the published figures."""
