"""Box-box contact for simulators: do two boxes touch, where, and which way do they push?"""
from .contact import Contact, Contacts
from .solver import MODELS, ContactSolver

__all__ = ['MODELS', 'Contact', 'ContactSolver', 'Contacts']
