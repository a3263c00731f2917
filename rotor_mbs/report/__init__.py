"""Render pages, figures and animations from stored files.

build          makes all pages of a report
pages          one module per page, which turns stored data into the content of the page
elements       classes for the content of a page: sentences, facts, plots, tables, sections
curves         stores the numbers of a page's plots
stills         draws still pictures of plots and paths, for browsers without scripts
files          renders pages as HTML by templates, and writes them
templates      HTML, style and scripts of the pages
looks          colours, lines and markers
numbers        writes numbers as text
paper_figures  lists the paper's figures, and chooses the runs of each
tip_paths      computes the lines in a picture of the tips' paths
canvas         draws with matplotlib; figures, plots, animations and some pages use it
figures        figures for a manuscript
plots          figures for notebooks
animation      animations as files

Pages only show what their file has: no equation is integrated for them. They can therefore be made
if no engine and no SciPy can be imported.
"""
