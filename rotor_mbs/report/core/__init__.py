"""What every page and figure is made with: canvas, SVG, page elements, templates, number formats, files."""
