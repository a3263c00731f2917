"""Pages, figures and animations from stored files alone; no engine is needed.

core       the canvas (matplotlib), SVG for a page, the page environment, number formats, writing of files
plots      one drawing function per kind of plot, for pages and for manuscript figures
pages      one module per page: stored data to the content of the page
templates  the pages' HTML, style and scripts
"""
