"""What shows a scene: the page in the browser, and markers for RViz."""
