"""One drawing function per kind of plot, from plain arrays; pages and manuscript figures use the same."""
