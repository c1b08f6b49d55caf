"""Which function makes which table, figure and quoted number of the papers."""
