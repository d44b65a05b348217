"""handtrack: joint angles of a human hand over time, from an ordinary video."""
