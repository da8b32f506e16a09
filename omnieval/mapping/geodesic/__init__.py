"""A mapper that measures travel by how fast images become unlike, and makes nodes of places near along the way."""
