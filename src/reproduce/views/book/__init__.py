"""What only the book calls: its pages, the numbers of its sentences, the step before a build."""
