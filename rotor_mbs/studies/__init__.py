"""One module per job: cases in, records out. Knows no terminal and no argument parser."""
