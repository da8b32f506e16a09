"""From images to panoramas: decoding, mirror geometry, unwrapping."""
