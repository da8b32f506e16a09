"""Images of another sequence found in the map of a run."""
