"""Pages, figures and animations from stored files alone; no engine is needed.

core       the canvas (matplotlib), looks of curves, SVG for a page, templates, number formats, writing of files
plots      what several pages draw: curves over time, paths of tips; plain arrays
pages      one module per page: stored data to the content of the page, and the pictures that it alone has
templates  the pages' HTML, style and scripts
"""
