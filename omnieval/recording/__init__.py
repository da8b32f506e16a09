"""The recording: a replay as the Rerun viewer shows it. The only package that imports rerun."""
