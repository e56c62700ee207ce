"""Box-box contact for simulators: whether two boxes touch, where, and which way they push."""
from .contact import Contact, Contacts
from .solver import MODELS, ContactSolver

__all__ = ['MODELS', 'Contact', 'ContactSolver', 'Contacts']
