"""Reference partitions to compare a map with."""
