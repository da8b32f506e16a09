"""A mapper that recognises places by runs of images, and makes nodes of what is near in the plane by dead reckoning."""
