"""Box-box contact for simulators: whether two boxes touch, where, and which way they push."""
from .solver.contact import Contact, Contacts
from .solver.contact_solver import ContactSolver
from .solver.models import MODELS

__all__ = ['MODELS', 'Contact', 'ContactSolver', 'Contacts']
