"""Many runs of several filters, and what they say."""
