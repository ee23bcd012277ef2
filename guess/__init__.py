"""First motions to start from: automatic, random, given by a user, or taken from another mesh."""
