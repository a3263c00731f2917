"""One module per page: stored data to the content of the page."""
