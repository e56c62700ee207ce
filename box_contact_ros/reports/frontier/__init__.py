"""Speed against error: the program `frontier`, its speed gates."""
