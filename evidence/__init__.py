"""What was measured, how, and on what: one script per table or figure.

`python -m evidence.run` (or `make evidence`) remakes all of it: per script a record in
docs/evidence/records, a page in docs/evidence, filled from the record by the template in
`pages`, and its pictures. Recordings are found through MOTIONARY_DATA; none of them enters
the project. What a script consists of is listed in `common.running`.
"""
