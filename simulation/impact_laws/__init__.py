"""Laws of a hit with a tangential impulse, a file each: from rates before it to impulses."""
