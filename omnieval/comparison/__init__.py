"""Methods held against each other over many runs: estimates, paired differences, ranks."""
