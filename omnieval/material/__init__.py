"""One way to open what is replayed: a source of any kind, or what a run replayed, exactly as it was.

A sequence of images and an archive of descriptors become the same `Material` (`opening`). What a run replayed is opened
again by what it says of itself (`reopened`); more images may follow on its map (`continued`).
"""
