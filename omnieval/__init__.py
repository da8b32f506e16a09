"""omnieval replays incremental topological mapping over omnidirectional images and keeps every decision's evidence."""

__version__ = "0.1.0"
