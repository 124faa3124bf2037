"""What `validation/run.sh` is made of; the table in the package above says what each module is for."""
