"""The formulas. Functions take arrays, return arrays and read no files.

The `__init__.py` of each subpackage imports its public names. Names and modules with a leading
underscore are private. A public function validates its arguments once, and private functions trust
them. Arguments are finite real numbers of the stated shapes and ranges. In one function n always is
the same number, and leading (batch) axes broadcast. Lengths are positive, standard deviations and
weights are not negative, and rotation matrices are proper. Any other argument raises a TypeError or
ValueError with the expected value, the given value and a remedy. *Raises* in a docstring lists
further errors.
"""
