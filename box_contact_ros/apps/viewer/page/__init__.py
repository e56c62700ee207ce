"""The page in the browser: what is drawn, what is read off, what can be asked for."""
