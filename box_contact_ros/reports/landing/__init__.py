"""Landings: by which way of contact and force the load comes to rest."""
