"""Reference partitions to hold a map against."""
