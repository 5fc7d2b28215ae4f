"""Stand-ins, faulty implementations and searches that several tests share."""
