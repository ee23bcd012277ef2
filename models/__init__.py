"""The systems that come with dmoc, each written as a textbook would; see
:func:`dmoc.models.catalogue.names`."""
