"""The method: nodes, gates, matching, the mapper and the evidence of its steps. Takes arrays, returns decisions."""
