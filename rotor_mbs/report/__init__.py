"""Render pages, figures and animations from stored files.

elements   what a page is made of, as data: sentences, facts, plots, tables, sections
curves     the numbers of a page's plots; stills: still pictures, for a page without scripts
paper_figures  the paper's figures, and the runs of each; tip_paths: pictures of paths
files      pages as HTML by the template, and their writing
looks      colours and lines; numbers: numbers as text
pages      one module per page: stored data to the content of the page
canvas     matplotlib: figures for a manuscript (figures), notebooks (plots),
           animations (animation)
templates  the pages' HTML, style and scripts

Nothing is integrated: a page shows what its file has, also where no engine and no SciPy can be
imported.
"""
