"""Images that lie in one file: videos and bags, decoded once into the cache and then read like a folder."""
