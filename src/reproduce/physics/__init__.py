"""The formulas: arrays in, arrays out; nothing here reads a file or knows a printed number.

The `__init__` of each room names what other rooms, pages and users may call; names and modules with
a leading underscore belong to the room. A public function checks what it is given, once; the
kernels behind it trust it. It takes finite real numbers of the shapes and within the ranges that
its docstring states (n is one number wherever it stands, leading (batch) axes broadcast), lengths
above zero, standard deviations and weights of zero or more, and proper rotation matrices. All else
raises a TypeError or ValueError that says what was expected, what came and what to do. *Raises* in
a docstring names what is refused beyond that.
"""
