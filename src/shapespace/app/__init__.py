"""The explorer: stored runs, branches, curves, searches and diagrams in a browser, served on this machine or in one file."""
