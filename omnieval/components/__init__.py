"""Descriptors and mappers by name, by place, or as objects, each with its own identity.

A component is named on the command line, in files and from Python by

- a name: ``hog``, ``leader``, or one that an installed package registers under the entry points `names.GROUPS`,
- ``package.module:Class``,
- ``path/file.py:Class``,
- ``onnx:MODEL.onnx``, a descriptor that a network in a file makes.

Its **identity** is its name, its settings, a digest of its source code and one of its weights: equal identities make
the same of the same input. The source code is the component's module and the modules of the same package (or folder,
for a file) that it imports, directly or not.
"""
