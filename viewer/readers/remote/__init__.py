"""Scans at an address (https://, s3://): read by ranges into a copy in the cache folder, from which the readers read."""
