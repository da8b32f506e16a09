"""Methods compared with each other over many runs: estimates, paired differences, ranks."""
