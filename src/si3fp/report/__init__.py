"""What people read and open: the report of a run, its figures and its map layer."""
