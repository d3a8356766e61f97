"""Procedures of somebody who does not mean well."""
