"""Numbers that judge a map."""
