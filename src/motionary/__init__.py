"""motionary"""
